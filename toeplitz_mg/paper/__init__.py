"""The problems of the paper, and the numbers that it prints."""
