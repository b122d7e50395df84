"""Ties between the numbers of a program: relations found and priced, names for what stays free."""
