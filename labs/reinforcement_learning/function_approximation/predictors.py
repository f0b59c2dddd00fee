"""Learners of a value (labs/algorithms/approximation.py) as the plain arrays of a training."""

from labs.algorithms.approximation import LinearPredictors
from labs.arrays import Training
from labs.reinforcement_learning.function_approximation.learning_world import Fields


def arrays_of(learners: LinearPredictors) -> Fields:
    """What a training keeps of them."""
    return {
        "w": learners.w,
        "h": learners.h,
        "count": learners.count,
        "random": learners.random,
        "errors": learners.errors,
        "alive": learners.bounded,
    }


def predictors_of(training: Training) -> LinearPredictors:
    """The learners of a training."""
    return LinearPredictors(
        w=training["w"],
        h=training["h"],
        count=training["count"],
        random=training["random"],
        errors=training["errors"],
        bounded=training["alive"],
    )
