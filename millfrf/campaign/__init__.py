"""Campaigns: hundreds of recordings through all jobs, on one machine or a cluster, with results that stay."""
