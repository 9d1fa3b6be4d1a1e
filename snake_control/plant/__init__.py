"""What the joints move: the body on the floor."""
