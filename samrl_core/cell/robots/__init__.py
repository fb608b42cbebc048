"""Arms and cells: specs with sources, kinematics, dynamics, shapes."""
