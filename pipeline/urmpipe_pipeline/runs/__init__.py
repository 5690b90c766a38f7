"""From a joint log to a run: ingest, its chapters and its presentation."""
