def pack(item): return None, b""
