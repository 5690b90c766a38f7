"""Files as tables: encoding, delimiter, header, rows, and what is wrong with them."""
