"""Point cloud formats, a file each: a module that defines `FORMAT` is a format (`dlogen.io.registry`)."""
