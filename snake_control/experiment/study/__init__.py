"""Which links should lose their wheels, and which head joints be H-SCPs (open in the paper)."""
