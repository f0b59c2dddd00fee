"""Where temporal differences with function approximation diverge, for the labs of function
approximation and deep Q-learning to come."""
