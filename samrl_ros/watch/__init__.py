"""Watches a live graph: windows of joint topics into bags, a diagnosis of each, and /diagnostics."""
