"""The paper's own stages, III.B and III.C: profile paper."""
