"""What cloud formats are read with and written by: headers, rows of text, tables of records, PLY, LZF."""
