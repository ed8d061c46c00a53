"""The paper's two studies: sparsity of depth images in frequency, and image edges as predictors of depth edges."""
