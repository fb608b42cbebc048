"""Topics, nodes, bags and the command line of the samrl cell."""
