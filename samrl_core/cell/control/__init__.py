"""The command guard: one library for the manipulator's output, the bridge, and drivers of hardware."""
