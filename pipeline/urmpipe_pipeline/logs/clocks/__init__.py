"""Which columns are the time, in which unit, and the times they hold."""
