"""What an application's or a plug-in's author tests with."""
