"""Search designs: sampler, rounds, replication, confirmation, tolerances."""
