"""Systems of the plane and the plane drawn beside the moving body, for the labs of MPC and of
Lyapunov functions to come."""
