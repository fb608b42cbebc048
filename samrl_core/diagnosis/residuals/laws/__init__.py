"""What a control law makes of a log: its output, its velocity, what is late or follows the command."""
