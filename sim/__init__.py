"""Physics of a dog clutch engagement: geometry to expected shift time and strength."""
