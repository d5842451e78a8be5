"""Tools for the tests of an application's or a plug-in's author."""
