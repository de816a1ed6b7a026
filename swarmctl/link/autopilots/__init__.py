"""What each flight stack calls things and how it behaves, one module per stack."""
