"""Synthetic people and registrations, with known answers: nothing in here was measured."""
