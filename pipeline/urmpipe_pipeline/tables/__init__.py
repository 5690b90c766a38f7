"""Tables for other programs: JUnit XML and CSV of what a presentation holds."""
