"""What a register map may say of a register, and what it has to have."""
