"""Names of the strategies; free of imports, for the command line."""

REAL2SIM, UNIFORM, ADR, SIMOPT = "real2sim", "uniform", "adr", "simopt"
RANDOMISATIONS = (REAL2SIM, UNIFORM, ADR, SIMOPT)
