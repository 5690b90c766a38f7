"""What the code is measured by: a subject a module. Code is read as text and syntax, never run."""
