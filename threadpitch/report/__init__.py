"""What people look at: drawings and reports. The only place that plots."""
