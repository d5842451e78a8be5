"""Mission documents: an application's graph written as data, and flown from it.

It imports `environment` itself and all that lies below; nothing but the command line imports it.
"""
