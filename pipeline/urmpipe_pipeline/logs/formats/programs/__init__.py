"""Robot and PLC programs as tables: the positions that they declare or move to, the arrays that they hold."""
