"""Values leave the house: events of the store to MQTT brokers, and an OPC UA server that plants read."""
