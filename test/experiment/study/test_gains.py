"""A study tries choices with gains that fit all of them."""

from snake_control.config import ControllerConfig
from snake_control.experiment.study.gains import gains_text, scale_free


def test_the_paper_s_gains_give_way_and_the_rest_stays():
    given = ControllerConfig(case=2, K=(1.0,) * 6, a_prime=1.3e-12, joint_range_margin_rad=0.4)
    wanted = ControllerConfig(case=2, K=(1.0,) * 6, preset="scale_free", joint_range_margin_rad=0.4)
    assert scale_free(given) == wanted


def test_what_somebody_chose_stays():
    for chosen in (
        ControllerConfig(base_sub_tasks=("fall", "my.module:Mine")),
        ControllerConfig(head_sub_tasks=("none",)),
        ControllerConfig(preset="scale_free", a_b=2.0),
    ):
        assert scale_free(chosen) is chosen


def test_one_line_says_which():
    assert gains_text(ControllerConfig(case=3)) == (
        "preset paper: head manipulability 100000; base singularity 1e-11, fall 3; law gradient"
    )
    assert gains_text(ControllerConfig(case=1)).startswith("preset paper: head none; base none;")
