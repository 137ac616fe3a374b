"""Chapter 10, how true the synthetic image is: points against an ideal picture."""
