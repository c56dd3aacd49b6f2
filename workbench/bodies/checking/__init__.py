"""What is wrong with the file of a body model, in sentences that say what to do about it."""
