"""Thin ROS 2 nodes: messages in and out; the mathematics and the protocol live elsewhere."""

import os

# Matrices of a dozen rows gain nothing from threads, and idle ones of BLAS take time from the other
# nodes. This has to be set before numpy is imported for the first time.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
