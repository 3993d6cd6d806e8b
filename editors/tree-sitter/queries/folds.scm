; A list that spans several lines folds to its first one.
(list) @fold
(block_comment) @fold
