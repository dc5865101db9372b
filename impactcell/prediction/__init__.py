"""mu_s and mu_k from one capture: peak force, sliding distance, their combination, and the full waveform."""
