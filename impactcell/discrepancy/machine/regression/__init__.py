"""The equation of motion as a linear regression: its rows, their blocks, and terms tried beside a model."""
