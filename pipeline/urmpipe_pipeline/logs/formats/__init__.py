"""Formats: a file becomes a `LogTable`, columns with names, units and cells. Nothing here knows a joint.

`opening` selects the format of each file, by its first bytes, and which source wrote it.

- Text: `text` (bytes, compression, encoding), `sniff` (delimiter, header, units), `cells`, `sniff_rows` and
  `row_form` (labels, arrays in cells), `text_table` (rows).
- Typed columns: `parquet`, `matlab` (MAT, HDF5), `arrays` (NumPy, Python), `bag` and `bag_table` (MCAP, ROS),
  as tables in `memory`.
- Other files: `json` (and YAML), `workbook`, `programs` (robots, PLCs), `urmpipe_tables`.
- Any table: `shape` (joints as rows, flat arrays, rows, episodes), `long_form`; `log_table`, its numbers, and
  times in the forms of `clock_forms`. `files` has access to files and optional libraries.
"""
