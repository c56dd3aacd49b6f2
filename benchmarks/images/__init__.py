"""Bodies fitted to keypoints in images and videos, against what is known of them."""
