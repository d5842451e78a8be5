"""People in pictures: joints, gestures, falls, and how close they stand."""
