"""A recording of one object: one model for all captures, and its motion.

A *capture* is a cloud that shows the object once: what a camera gives at one time, or one of several clouds in no
order. Commands, messages and files call it a frame, as people who record do; in this code a *frame* is a coordinate
frame. In shapes of arrays, F is the number of captures.

`assemble` reads like the method: the single fits (`captures`), the model that they share (`shared_model`, by
`outliers`, `orientation`, `rigid_links` and `interpolation`), its motion (`trajectory`, by `joint_values`), and the
files (`export`, with `trajectory_tables`, `report` and `plot`). Only `captures` reads, and nothing here writes.
"""
