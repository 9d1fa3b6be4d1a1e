"""Sub-tasks as somebody else may write them."""

STRAIGHT = """
    import numpy as np
    from snake_control.control.sub_tasks import SubTask

    class Straight(SubTask):
        def value(self, posture):
            base = posture.g.q[6 + self.robot.head_links :]
            return -0.5 * float(base @ base)

        def gradient(self, posture):
            by_q = np.zeros(len(posture.g.q))
            first = 6 + self.robot.head_links
            by_q[first:] = -posture.g.q[first:]
            return by_q
"""
"""A good one."""

LATE = """
    import numpy as np
    from snake_control.control.sub_tasks import SubTask

    class Late(SubTask):
        calls = 0

        def value(self, posture):
            return 0.0

        def gradient(self, posture):
            self.calls += 1
            return np.zeros(len(posture.g.q)) if self.calls < 10 else {}["gone"]
"""
"""One that fails a few steps after the start."""
