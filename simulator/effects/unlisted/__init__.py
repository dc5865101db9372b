"""Effects outside the vocabulary: real enough to happen, known to no library of the product."""
