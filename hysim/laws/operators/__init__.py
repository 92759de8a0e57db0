"""Laws that are sums of elementary operators: plays, stops and relays."""
