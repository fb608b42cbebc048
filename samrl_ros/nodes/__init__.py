"""One file per node; each converts, calls the core, converts, publishes."""
