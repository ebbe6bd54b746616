"""What a step of finite length costs, taken apart."""
