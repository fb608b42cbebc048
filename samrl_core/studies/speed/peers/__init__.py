"""Other people's libraries on the same work: one file each, imported only when it is measured."""
