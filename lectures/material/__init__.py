"""What lectures and examples teach with: tubes, limbs, bodies in pieces, and measures of them."""
