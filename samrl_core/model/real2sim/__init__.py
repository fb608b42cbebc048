"""Parts of the inverse problem: distance between clouds, minimiser, information."""
