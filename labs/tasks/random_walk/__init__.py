"""Random walks of the literature as finite MDPs, for the labs of prediction, TD(lambda) and
function approximation to come."""
