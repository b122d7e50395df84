"""The continuous numbers of a program: ``adjust(program, evidence)`` moves them all by Gauss-Newton steps."""
