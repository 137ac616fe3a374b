"""The camera on its mount: the `stability` of the boresight, shown `over_time`."""
