"""What a loop of fitting and learning is worth, as SPIN has it: fits teach a regressor of poses,
which gives the next fits their starts.
"""
