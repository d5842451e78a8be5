from .pictures import Pictures as Pictures
from .pictures import boxed as boxed
from .pictures import recorded_pictures as recorded_pictures
from .tables import live_table as live_table
from .tables import recorded_table as recorded_table
