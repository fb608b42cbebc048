"""Images of a cell: how they are diagnosed, what is corrected by them, what to record next."""
