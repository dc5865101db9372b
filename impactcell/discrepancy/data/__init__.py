"""What the workflow works on: shots and blocks with covariates, checked, grouped and split."""
