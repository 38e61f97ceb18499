"""What cloud formats are read with: tables of records, LZF, lists in PLY."""
