"""The examples in the docstrings of protocols run as they stand."""

import inspect

import pytest
from helpers.pages import blocks

from planning.coordination.decision import Coordination, Decider
from planning.objective.terms import Term
from planning.optimizers.optimizer import Optimizer
from planning.planner import Planner
from planning.prediction.propagation import Propagation
from tracking.detection.detector import Detector
from tracking.filter.motion import MotionModel
from tracking.fusion.member import Member
from tracking.fusion.rule import FusionRule

PROTOCOLS = [Coordination, Decider, Term, Optimizer, Planner, Propagation, Detector, MotionModel, Member, FusionRule]


@pytest.mark.parametrize("protocol", PROTOCOLS)
def test_the_example_of_a_protocol_runs(protocol):
    ((language, code),) = blocks(inspect.cleandoc(protocol.__doc__).replace("\n    ", "\n"))
    assert language == "python"
    exec(code, {"__name__": "example"})
