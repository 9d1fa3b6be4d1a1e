"""A trajectory and a hostile reference through all nodes; ``make heads GRAPH=1`` tries more."""

from __future__ import annotations

from heads.in_graph import Campaign, give_rad, shortest

from support.head_trajectories import HOSTILE_KINDS
from support.whole_graph import WholeGraph


def test_what_the_robot_can_do_is_done_and_a_jumping_reference_is_ridden_out(tmp_path):
    with WholeGraph(tmp_path) as robot:
        campaign = Campaign(robot)
        done = campaign.try_feasible(shortest(1)[0])
        assert done.accepted, done.refusal
        assert done.completed
        assert not done.fell
        assert done.error_m < 0.01
        ridden_out = campaign.try_hostile(HOSTILE_KINDS.index("jump"))
        assert not ridden_out.fell
        assert ridden_out.completed, f"tracked again after {ridden_out.took:.1f} s"
        for outcome in (done, ridden_out):
            assert outcome.range_rad <= give_rad()
            assert outcome.speed_rad_s <= 1e-9
