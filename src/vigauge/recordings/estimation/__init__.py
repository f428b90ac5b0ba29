"""From a recording to an estimate with its covariance, without a configuration file or a ground truth."""
