"""The list of choices holds all that the paper's conditions allow, and nothing else."""

import itertools

import pytest

from snake_control.config import RobotConfig
from snake_control.errors import ConfigError, StudyError
from snake_control.experiment.study.candidates import Candidate, admissible, sample
from support.robots import PAPER, ROBOTS


def test_the_paper_s_robot():
    found = admissible(PAPER)
    assert Candidate((7, 9, 11), (3,)) in found
    assert Candidate((7, 9, 10), (3,)) in found  # Fig. 2
    assert len(set(found)) == len(found)
    assert found == sorted(found)
    # Condition 4: m = 1 + wheelless links < 5; Assumption 5 and Condition 1 keep links 6 and 12.
    sizes = {len(candidate.wheelless_links) for candidate in found}
    assert sizes == {0, 1, 2, 3}
    assert {link for c in found for link in c.wheelless_links} == {7, 8, 9, 10, 11}


@pytest.mark.parametrize("name", ["paper", "minimal head", "long head, two H-SCPs"])
def test_nothing_allowed_is_left_out(name):
    robot = ROBOTS[name]
    found = set(admissible(robot, [2]))
    every_head = itertools.combinations(range(1, robot.head_links + 1), robot.head_links - 4)
    for joints in every_head:
        for links in itertools.combinations(range(1, robot.links + 1), 2):
            candidate = Candidate(links, joints)
            try:
                candidate.robot(robot)
            except ConfigError:
                assert candidate not in found
            else:
                assert candidate in found


def test_too_many_are_refused_and_few_enough_are_not():
    long = RobotConfig(
        links=40,
        joint_axes=("pitch", "yaw", "pitch", "yaw", "pitch") + ("yaw",) * 34,
        start_joint_angles_rad=(0.0,),
    )
    with pytest.raises(StudyError, match="wheelless links to look at"):
        admissible(long)
    assert {len(c.wheelless_links) for c in admissible(long, [1, 2])} == {1, 2}
    with pytest.raises(StudyError, match="no choice with 99 of the links 6 to 11 wheelless"):
        admissible(PAPER, [99])


def test_a_sample_is_drawn_without_repetition_and_repeats_itself():
    found = admissible(PAPER)
    drawn = sample(found, 20, seed=4)
    assert len(set(drawn)) == 20
    assert drawn == sample(found, 20, seed=4)
    assert drawn != sample(found, 20, seed=5)
    assert sample(found, 10_000, seed=4) == found
