"""What `impactcell estimate` writes of each shot, for those that read it on, too."""

COLUMNS = (
    "shot", "mu_s_force", "mu_s_distance", "mu_s_combined", "mu_s", "mu_s_std", "mu_k", "mu_k_std",
    "mu_s_force_std", "mu_s_distance_std", "mu_s_combined_std", "estimator", "quality", "mu_k_quality",
    "peak_force_n", "sliding_distance_m", "gap", "reason", "mu_s_common_std",
)  # fmt: skip
