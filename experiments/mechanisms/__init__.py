"""Machines declared by masses, forces and contacts, each measured against a result known beforehand."""
